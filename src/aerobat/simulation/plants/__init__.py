"""Plants, which turn rotor commands into a vehicle's state; here the simulators of others."""

from aerobat.simulation.plants.plant import PLANTS, Actuation, Plant, PlantRun, PlantScene

__all__ = ["PLANTS", "Actuation", "Plant", "PlantRun", "PlantScene"]
