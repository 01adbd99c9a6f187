"""Loops on deformable bodies: stability about a contact, certificates, Z-width and update rate."""
