"""What pages are put together from: paths, stages, timelines, signals, each drawn into its axes."""
