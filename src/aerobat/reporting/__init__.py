"""What people and machines get to see: figures, tables, reports."""
