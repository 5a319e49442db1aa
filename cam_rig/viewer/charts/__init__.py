"""What the viewer shows beside cam and follower: time series, charts, text."""
