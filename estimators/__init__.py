"""State and parameter estimators on a discrete disc-thread model.

Nothing is here yet: Kalman filters on `DiscreteModel` are to come in a later release.
"""
