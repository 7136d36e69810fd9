"""The subcommands of adversarial-lcd, a module each: ``add`` declares its options."""
