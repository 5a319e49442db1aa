"""The paper's jump speeds: the lowest speed at which a follower loses contact."""
