"""What a config says, checked: settings, checks across fields, paths."""
