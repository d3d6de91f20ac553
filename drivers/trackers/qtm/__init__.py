"""Qualisys: poses from Qualisys Track Manager (QTM) over its real-time protocol."""
