"""What commands share: the console, names of files, options, outputs."""
