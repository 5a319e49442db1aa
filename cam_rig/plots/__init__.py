"""Pictures on paper: matplotlib figures of laws, contours and studies."""
