"""Certificates, who may command, and who is at the other end."""
