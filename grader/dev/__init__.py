"""What only developers of rosgrade need: timings, soak tests, the generator of docs, the demo."""
