"""Faults of the tracking system that a simulator serves."""

from __future__ import annotations

from quadrotor.parameters import Parameters, parameter


class TrackingFaults(Parameters):
    """Faults of the served tracking system, as laboratories have them."""

    dropped: float = parameter(0.0, ge=0, le=1, step=0.05)
    """share of the served frames that are not sent"""
    body_lost: bool = parameter(False)
    """the served system does not see the vehicle"""
    stamps_ahead: float = parameter(0.0, unit="s", ge=-10, le=10, step=0.5)
    """by which the served stamps are set"""
    y_up: bool = parameter(False)
    """poses are served in axes with y up"""
    millimetres: bool = parameter(False)
    """positions are served in mm"""
    stopped: bool = parameter(False)
    """the servers of poses are stopped"""
