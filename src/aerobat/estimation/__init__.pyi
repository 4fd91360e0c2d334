from .settings import Ekf

__all__ = ["Ekf"]
