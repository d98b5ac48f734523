"""What an experiment can show: sizes that would be seen, and inputs that tell two causes apart."""
