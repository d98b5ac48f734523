"""Quality of records: faults that limit a diagnosis."""
