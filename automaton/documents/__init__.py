"""Documents as the output of commands, and their formats: text, Markdown, HTML, workbook."""
