"""Where two masses stop being enough: a stem of n masses, and the bar that is their limit."""
