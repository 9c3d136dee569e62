"""What every YAML file of rosgrade is read with: names, quantities with units, lines of errors."""
