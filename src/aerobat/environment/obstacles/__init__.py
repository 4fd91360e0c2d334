"""Obstacles in the world: declared shapes made of convex pieces, and the distance of a body from them."""

from aerobat.environment.obstacles.convex_piece import ConvexPiece
from aerobat.environment.obstacles.obstacle import OBSTACLES, Obstacle, obstacle
from aerobat.environment.obstacles.separation import Pieces, Separation

__all__ = ["OBSTACLES", "ConvexPiece", "Obstacle", "Pieces", "Separation", "obstacle"]
