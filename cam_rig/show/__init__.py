"""What plots and the viewer draw with: colours, outlines, the follower's shape."""
