"""Rigs for the tests, from bytes on a wire to daemons as processes; each module says which level it serves."""
