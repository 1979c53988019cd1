"""Tables, figures and texts of every result: terminal, HTML, PDF, JSON, Parquet and workbook."""
