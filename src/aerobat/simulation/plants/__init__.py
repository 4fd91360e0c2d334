"""Plants: whatever answers rotor commands with a state; here the physics that others wrote."""

from aerobat.simulation.plants.plant import PLANTS, Actuation, Plant, PlantRun, PlantScene

__all__ = ["PLANTS", "Actuation", "Plant", "PlantRun", "PlantScene"]
