"""The parts of a page: paths, stages, timelines and signals, each drawn into its own axes."""
