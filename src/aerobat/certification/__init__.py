"""Proofs over continuous time that a vehicle flies a trajectory within its limits, without any planner."""

from aerobat.certification.certificate import Certificate, Discontinuity, Finding, Side, Verdict
from aerobat.certification.certify import certify
from aerobat.certification.envelope import Envelope

__all__ = ["Certificate", "Discontinuity", "Envelope", "Finding", "Side", "Verdict", "certify"]
