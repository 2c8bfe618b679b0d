"""What a posterior says, as tables: computed here, drawn in `report`."""
