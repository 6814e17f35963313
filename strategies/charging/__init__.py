"""Charging: when, where and how long does a robot charge?"""
