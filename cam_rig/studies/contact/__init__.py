"""Contact of cam and follower: Hertz pressure, sliding, and the base radius that they ask for."""
