"""Contact of cam and follower: Hertz pressure, sliding, and base radius."""
