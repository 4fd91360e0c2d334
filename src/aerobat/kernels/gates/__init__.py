"""Gates as flights meet them, tick by tick: the crossing of their plane, and the body's section there."""
