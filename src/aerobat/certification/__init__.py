"""Proofs over continuous time that a vehicle flies a trajectory within its limits, without any planner."""

from aerobat.certification.certificate import Certificate as Certificate
from aerobat.certification.certificate import Discontinuity as Discontinuity
from aerobat.certification.certificate import Finding as Finding
from aerobat.certification.certificate import Side as Side
from aerobat.certification.certificate import Verdict as Verdict
from aerobat.certification.certify import certify as certify
from aerobat.certification.envelope import Envelope as Envelope
