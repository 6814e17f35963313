"""Routing: which cells does a robot drive through?"""
