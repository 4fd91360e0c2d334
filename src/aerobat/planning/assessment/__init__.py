"""The judgement of a plan: against what is possible, and against the room and the rates that are usual."""
