"""Stack interface: any navigation stack on trial, and the referee of its commands."""
