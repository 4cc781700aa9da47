"""Contact sheets: pictures of a file by clpeel and by other programs, side by side (tools/contact_sheet.py)."""
