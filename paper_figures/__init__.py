"""Figures of tables: each module draws one, from data frames alone, and runs nothing."""
