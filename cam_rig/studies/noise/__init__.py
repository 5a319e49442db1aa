"""The paper's noise experiment: calibrate on one cam, predict another, identify the third."""
