"""Studies made with palpate; each is run as `python -m experiments.<name>`."""
