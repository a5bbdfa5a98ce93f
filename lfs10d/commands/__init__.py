"""Requests from the broker: admitted, carried out, answered once."""
