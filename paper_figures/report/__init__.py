"""The report: what the paper says beside what the tables of the studies say; it runs nothing."""
