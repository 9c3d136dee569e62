"""The kinds of stimuli: each module has the models of what the YAML may say."""
