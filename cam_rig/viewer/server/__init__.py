"""Where a Rerun recording is shown: a desktop viewer, or a web page that this machine serves."""
