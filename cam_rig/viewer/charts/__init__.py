"""What the viewer shows beside the moving picture: time series, bars, curves, words."""
