"""Settings of the tracking controller, its kernel parameters, and custom control laws."""

from aerobat.control.law import CONTROL_LAWS as CONTROL_LAWS
from aerobat.control.law import ControlLaw as ControlLaw
from aerobat.control.law import Seen as Seen
from aerobat.control.law import as_controller as as_controller
from aerobat.control.law import controller as controller
from aerobat.control.law import named_controller as named_controller
from aerobat.vehicle.controller import Controller as Controller
