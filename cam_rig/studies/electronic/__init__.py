"""Electronic cams: texts for motion controllers and back, with proven errors."""
