"""Obstacles in the world: declared shapes, each made of convex pieces, and how far a body is from them."""

from aerobat.environment.obstacles.convex_piece import ConvexPiece
from aerobat.environment.obstacles.obstacle import OBSTACLES, Obstacle, obstacle
from aerobat.environment.obstacles.separation import Pieces, Separation

__all__ = ["OBSTACLES", "ConvexPiece", "Obstacle", "Pieces", "Separation", "obstacle"]
