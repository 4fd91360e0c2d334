"""Passages of gates, tick by tick: the crossing of the gate's plane, and the body's section there."""
