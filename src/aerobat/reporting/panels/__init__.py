"""The parts of a page: paths, stages and timelines, each drawn into its own axes."""
