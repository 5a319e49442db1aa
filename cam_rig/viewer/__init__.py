"""Pictures: Rerun recordings and plots."""
