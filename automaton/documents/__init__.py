"""Documents that answer a command, and how they are written: text, Markdown, HTML, a workbook."""
