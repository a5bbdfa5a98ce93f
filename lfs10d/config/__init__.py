"""The configuration: from YAML files and changes by request to frozen models."""
