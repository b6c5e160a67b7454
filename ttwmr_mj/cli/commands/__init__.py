"""One file per subcommand: its options, their help, and its call."""
