"""Quality of records: what in them stands in the way of a judgement."""
