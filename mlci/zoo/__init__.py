"""Systems of many kinds, a module each, on which discretisations and inference are tried."""
