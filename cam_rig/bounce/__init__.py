"""When a follower bounces above its jump speed, how it bounces."""
