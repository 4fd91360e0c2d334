"""Obstacles in the world: declared shapes made of convex pieces, and the distance of a body from them."""

from aerobat.environment.obstacles.convex_piece import ConvexPiece as ConvexPiece
from aerobat.environment.obstacles.obstacle import OBSTACLES as OBSTACLES
from aerobat.environment.obstacles.obstacle import Obstacle as Obstacle
from aerobat.environment.obstacles.obstacle import obstacle as obstacle
from aerobat.environment.obstacles.separation import Pieces as Pieces
from aerobat.environment.obstacles.separation import Separation as Separation
