"""The MAVLink gateway: ground stations and MAVSDK fly the vehicle through the station."""
