"""Study of the contours of cams: points, checks, figures and files."""
