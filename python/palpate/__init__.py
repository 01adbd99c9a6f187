"""palpate: model a haptic device, prove what it can render stably, design the controller, run the loop."""
