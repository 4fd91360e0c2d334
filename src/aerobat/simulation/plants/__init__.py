"""Plants, which turn rotor commands into a vehicle's state; here the simulators of others."""

from aerobat.simulation.plants.plant import PLANTS as PLANTS
from aerobat.simulation.plants.plant import Actuation as Actuation
from aerobat.simulation.plants.plant import Plant as Plant
from aerobat.simulation.plants.plant import PlantRun as PlantRun
from aerobat.simulation.plants.plant import PlantScene as PlantScene
