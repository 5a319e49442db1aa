"""A flywheel of finite inertia: how much its speed fluctuates, and what that does to the twist."""
