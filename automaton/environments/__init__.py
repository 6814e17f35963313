"""Environments: many worlds of one scenario that a program steps and learns in."""

from automaton.environments.environment import Environment as Environment
