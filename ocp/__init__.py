"""Optimal control on a discrete disc-thread model.

Nothing is here yet: trajectory optimization and pressure MPC are to come in a later release.
"""
