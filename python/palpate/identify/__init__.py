"""Identification: experiments, recordings, ARX models, the device's own parameters and its friction."""
